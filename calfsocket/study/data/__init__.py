"""Study files of the package: the study of the paper and an example."""
