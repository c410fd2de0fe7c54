"""The program ciberrato-lab: make, draw and check labs."""
