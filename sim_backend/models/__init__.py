"""The tree's own vehicles as models like a user's, found by their entry points (glider.vehicles)."""
