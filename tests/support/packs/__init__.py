"""What tests do with packs."""
