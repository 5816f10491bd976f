# 64-bit Windows from Debian's MinGW-w64; programs are run by Wine.
# Packages: the section windows of cmake/debian-packages. The headers that ISE needs are the same for every system; fmt is
# used without its library, which is not.
set(CMAKE_SYSTEM_NAME Windows)
set(CMAKE_SYSTEM_PROCESSOR x86_64)
set(CMAKE_CXX_COMPILER x86_64-w64-mingw32-g++-posix) # its threads are those of the standard library
set(CMAKE_RC_COMPILER x86_64-w64-mingw32-windres)
find_program(ISE_WINE NAMES wine64-stable wine64 PATHS /usr/lib/wine)
mark_as_advanced(ISE_WINE)
if(ISE_WINE)
  set(CMAKE_CROSSCOMPILING_EMULATOR "${CMAKE_CURRENT_LIST_DIR}/wine.py" "${ISE_WINE}")
endif()
set(CMAKE_EXE_LINKER_FLAGS_INIT -static) # so that a program needs no DLL of the compiler beside it

# Beside these headers /usr/include has those of Linux, which must not be found: a folder has links to what is wanted only,
# and the CMake files of the packages.
set(ise_packages "${CMAKE_BINARY_DIR}/packages")
get_property(trying GLOBAL PROPERTY IN_TRY_COMPILE)
if(NOT trying)
  file(MAKE_DIRECTORY "${ise_packages}/usr/include")
  foreach(header asio asio.hpp cereal CLI catch2 fmt nlohmann rapidjson toml++)
    if(EXISTS "/usr/include/${header}")
      file(CREATE_LINK "/usr/include/${header}" "${ise_packages}/usr/include/${header}" SYMBOLIC)
    endif()
  endforeach()
  file(GLOB found /usr/lib/*-linux-gnu/cmake/cereal /usr/lib/*-linux-gnu/cmake/fmt /usr/lib/*-linux-gnu/libfmt.* /usr/lib/libCatch2*
    /usr/lib/cmake/Catch2 /usr/lib/*-linux-gnu/cmake/Catch2 /usr/share/cmake/nlohmann_json /usr/share/cmake/CLI11)
  foreach(one IN LISTS found)
    cmake_path(GET one PARENT_PATH folder)
    file(COPY "${one}" DESTINATION "${ise_packages}${folder}")
  endforeach()
endif()
foreach(package cereal fmt Catch2)
  file(GLOB found "${ise_packages}/usr/lib/*-linux-gnu/cmake/${package}" "${ise_packages}/usr/lib/cmake/${package}")
  list(POP_FRONT found ${package}_DIR)
endforeach()
unset(found)
unset(trying)
set(CMAKE_FIND_ROOT_PATH /usr/x86_64-w64-mingw32 "${ise_packages}")
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE ONLY)
