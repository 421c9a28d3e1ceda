"""The landmark database of Matsuda 2007 and its construction from runs."""
