"""THE CABLE: every byte between the laboratory and the board. SPEC.md is its text; imports no other package of ours."""
