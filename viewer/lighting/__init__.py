"""Light of a scene as plain data: sky, sun, panoramas, tone maps, and the float64 twin of the shading."""
