"""The size of the images that tests write into folders."""

SIZE = (20, 24)
