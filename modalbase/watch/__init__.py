"""Files that appear in folders become campaigns of a structure, one each.

Data flows one way: files that rest (`folders`) -> what is stated of each (`statements`, whose
`headings` people write as they like) -> what the service does not have yet -> campaigns
(`watching`). Nothing is kept on this side: what was sent is asked of the service, by SHA-256.
"""
