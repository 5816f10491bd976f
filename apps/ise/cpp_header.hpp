#pragma once
#include <ise/service/dynamic.hpp>

#include <string>
#include <vector>

namespace ise::cli {

/// The services of a component, for its header.
struct header_part {
    std::string component;
    std::vector<dynamic_contract> services;
};

/// A C++ header that declares the packets and the constants of these services, each component in a namespace of its
/// path. Its packets have the fingerprints of the originals; ranges of `ise::bounded` are not part of a schema. A
/// service whose packets cannot be declared (opaque types, names that are words of C++) is left out, with a comment.
std::string cpp_header(const std::vector<header_part>& parts);

} // namespace ise::cli
