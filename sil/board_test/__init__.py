"""The acceptance test of a board on a link: does it do what protocol/SPEC.md says, and how fast."""
