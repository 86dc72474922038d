"""Link data as people have them: what each format says, read with its meaning."""
