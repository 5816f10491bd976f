# What the library needs: from the system, or with ISE_FETCH_DEPENDENCIES fetched where it is missing.
set(ISE_FETCHED FALSE)
if(ISE_FETCH_DEPENDENCIES)
  include(FetchContent)
  set(FMT_INSTALL OFF)
  set(SKIP_PORTABILITY_TEST ON)
  set(SKIP_PERFORMANCE_COMPARISON ON)
  set(BUILD_DOC OFF)
  set(BUILD_SANDBOX OFF)
  set(JUST_INSTALL_CEREAL ON)
  set(JSON_BuildTests OFF)
  set(JSON_Install OFF)
  # By commit, which nobody can replace as a tag: cereal 1.3.2, fmt 9.1.0, nlohmann_json 3.11.2, asio 1.22.1 (below).
  # A commit cannot be fetched shallowly.
  FetchContent_Declare(cereal GIT_REPOSITORY https://github.com/USCiLab/cereal.git GIT_TAG ebef1e929807629befafbb2918ea1a08c7194554
    FIND_PACKAGE_ARGS CONFIG)
  FetchContent_Declare(fmt GIT_REPOSITORY https://github.com/fmtlib/fmt.git GIT_TAG a33701196adfad74917046096bf5a2aa0ab0bb50
    FIND_PACKAGE_ARGS CONFIG)
  FetchContent_Declare(nlohmann_json GIT_REPOSITORY https://github.com/nlohmann/json.git GIT_TAG bc889afb4c5bf1c0d8ee29ef35eaaf4c8bef8a5d
    FIND_PACKAGE_ARGS CONFIG)
  FetchContent_MakeAvailable(cereal fmt nlohmann_json)

  find_package(Asio 1.22 QUIET)
  if(NOT Asio_FOUND) # it has no CMake files of its own: fetch the tree, then find it there
    FetchContent_Declare(asio GIT_REPOSITORY https://github.com/chriskohlhoff/asio.git GIT_TAG bba12d10501418fd3789ce01c9f86a77d37df7ed)
    FetchContent_MakeAvailable(asio)
    set(ASIO_INCLUDE_DIR "${asio_SOURCE_DIR}/asio/include")
    set(ISE_FETCHED TRUE)
  endif()
  foreach(package cereal fmt nlohmann_json)
    if(NOT ${package}_FOUND)
      set(ISE_FETCHED TRUE)
    endif()
  endforeach()
endif()

# A project that embeds ISE may have made the targets already.
if(NOT TARGET asio::asio)
  find_package(Asio 1.22 REQUIRED)
endif()
if(NOT TARGET cereal::cereal)
  find_package(cereal REQUIRED)
endif()
if(NOT TARGET fmt::fmt)
  find_package(fmt REQUIRED)
endif()
if(NOT TARGET nlohmann_json::nlohmann_json)
  find_package(nlohmann_json REQUIRED) # private: only .cpp files see it
endif()
if(ISE_WITH_OPENSSL AND NOT TARGET OpenSSL::SSL)
  find_package(OpenSSL 3.0 REQUIRED) # private too
endif()
set(ise_fmt fmt::fmt)
if(ISE_FMT_HEADER_ONLY)
  set(ise_fmt fmt::fmt-header-only)
endif()
