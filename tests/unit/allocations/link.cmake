# Buffers grow by realloc and malloc: the library's calls of them are counted, and go on to whatever serves them
# (counting.cpp).
target_link_options(unit_${name} PRIVATE LINKER:--wrap=realloc LINKER:--wrap=malloc)
