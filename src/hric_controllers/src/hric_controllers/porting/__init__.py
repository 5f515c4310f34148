"""Command `hric port`: parts of a foreign controller that exist here, and a package for its port."""
