"""The subcommands of `ntc-viewer`: each reads its options, does one job, and returns an exit status."""
