# The warnings that ISE's own sources are built with; users inherit none of them.
function(ise_warnings target)
  target_compile_options(${target} PRIVATE -Wall -Wextra -Wpedantic -Wconversion -Wshadow -Wno-missing-field-initializers)
endfunction()

find_program(ISE_CCACHE ccache)
if(ISE_CCACHE AND PROJECT_IS_TOP_LEVEL AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
  set(CMAKE_CXX_COMPILER_LAUNCHER "${ISE_CCACHE}")
endif()
