"""He, Torrance, Sillion & Greenberg 1991: reflectance of rough surfaces by wave optics."""
