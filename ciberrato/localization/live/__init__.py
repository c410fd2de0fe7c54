"""The filter in a loop that must answer: a queue with a budget of time, and how well it kept up."""
