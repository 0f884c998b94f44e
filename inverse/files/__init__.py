"""Photographs and measured reflectance on disk."""

from inverse.files.images import MAX_PIXELS, read_image, write_image
from inverse.files.reflectance import Measurements, read_gonioreflectometer, read_merl, read_optical_constants
from inverse.files.stacks import Photographs, read_stack, write_stack
from inverse.files.whole_folders import whole_folder

__all__ = [
    "MAX_PIXELS",
    "Measurements",
    "Photographs",
    "read_gonioreflectometer",
    "read_image",
    "read_merl",
    "read_optical_constants",
    "read_stack",
    "whole_folder",
    "write_image",
    "write_stack",
]
