"""Where poses go: files, sockets, serial lines, the viewer."""
