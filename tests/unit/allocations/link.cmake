# Buffers grow by realloc: the library's calls of it are counted, and go on to whatever serves them (counting.cpp).
target_link_options(unit_${name} PRIVATE LINKER:--wrap=realloc)
