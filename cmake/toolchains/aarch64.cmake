# 64-bit ARM (a Raspberry Pi of the shore or the boat) from Debian's cross compiler; programs are run by qemu.
# Packages: the section aarch64 of cmake/debian-packages. The headers that ISE needs are the same for every processor, so
# no foreign architecture is added to dpkg; fmt is used without its library, which is not.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(CMAKE_CXX_COMPILER aarch64-linux-gnu-g++)
set(CMAKE_LIBRARY_ARCHITECTURE aarch64-linux-gnu)
find_program(ISE_QEMU NAMES qemu-aarch64-static qemu-aarch64)
mark_as_advanced(ISE_QEMU)
if(ISE_QEMU)
  set(CMAKE_CROSSCOMPILING_EMULATOR "${ISE_QEMU}")
endif()
set(CMAKE_EXE_LINKER_FLAGS_INIT -static) # so that qemu needs no root of that architecture
set(CMAKE_FIND_ROOT_PATH "/usr/aarch64-linux-gnu")
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
# Debian keeps the CMake files also of headers in the folder of the architecture that they were installed for.
foreach(package cereal fmt)
  file(GLOB folders "/usr/lib/*-linux-gnu/cmake/${package}")
  list(POP_FRONT folders ${package}_DIR)
endforeach()
