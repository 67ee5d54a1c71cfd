"""Starts of real windows that nobody touches: does each rest on the picture that `render` draws?"""
