"""Scripts: commands of the registry and stage directions, played in the window or without one."""
