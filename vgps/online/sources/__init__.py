"""What comes in live: frames of cameras and streams, messages of receivers."""
