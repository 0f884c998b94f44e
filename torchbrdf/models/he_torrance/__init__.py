"""Reflectance of rough surfaces by wave optics.

Source: He, Torrance, Sillion & Greenberg 1991, "A comprehensive physical model for light reflection", DOI
    10.1145/127719.122738. Its modules say "He et al. 1991".
"""
