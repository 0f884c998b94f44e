"""Tables that stand for a slow model: a few images of the geometry, and what each material takes of them."""
