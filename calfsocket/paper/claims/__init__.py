"""The paper's claims: what each is judged by, and the rules that judge."""
