"""What a finished run looks like: pictures, tables, facts, and the difference to another run."""
