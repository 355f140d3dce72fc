# Writes OUT: a C file with the text of PAGE as bytes, which need no quoting. Run by cmake -P at build time.
file(READ ${PAGE} hex HEX)
string(REGEX REPLACE "([0-9a-f][0-9a-f])" "0x\\1," bytes "${hex}")
file(WRITE ${OUT} "#include \"reenact/export/viewer_page.h\"\n\nconst char viewer_page[] = {${bytes}0};\n")
