"""The landmark database of Matsuda 2007, and its building from runs."""
