"""What the project is held against: verification stays on the laptop (NOT_ONBOARD in tools/deploy/bundle.py)."""
