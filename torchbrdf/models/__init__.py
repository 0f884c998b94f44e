"""BRDF models, one file or folder each."""
