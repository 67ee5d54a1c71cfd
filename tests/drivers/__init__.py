"""Drivers of OpenGL other than the system's, which tests and pictures are tried with."""
