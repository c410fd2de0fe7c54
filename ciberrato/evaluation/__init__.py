"""Many runs at once: how soon and how surely the agent localizes itself in many labs."""
