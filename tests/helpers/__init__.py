"""What several tests share: see README.md."""
