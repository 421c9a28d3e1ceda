"""GPS that cameras other than GoPros write into their videos or beside them."""
