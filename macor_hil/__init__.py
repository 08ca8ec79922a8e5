"""The MACOR controller: sees, learns situations and their transitions, plans by anticipation."""
