"""The Oren-Nayar family: a rough surface of Lambertian facets."""
