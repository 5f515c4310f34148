"""Import of an arm's motions from robot learning data sets, and their replay in experiments."""
