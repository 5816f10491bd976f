#pragma once
#include "connections.hpp"
#include "needs.hpp"
#include "styled.hpp"
#include "survey.hpp"

#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace ise::cli {

/// Bytes a second of a connection, between two surveys.
struct connection_rate {
    double to_a = 0, to_b = 0;
};

/// A need that no component fulfils.
struct missing_need {
    std::string component, service;
};

/// What `ise graph` draws: the components that were asked for and those that they are connected to.
struct drawn_graph {
    std::vector<surveyed> components;
    std::vector<connection_line> lines;
    std::vector<std::optional<connection_rate>> rates;              ///< of each line; nothing: not known
    std::map<std::pair<std::string, std::string>, double> services; ///< rate by provider and service, of all its users
    std::map<std::pair<std::string, std::string>, std::uint8_t> kinds; ///< service_kind by provider and service
    std::vector<missing_need> missing;
};

/// Of two surveys of everything; `before` may be empty: there are no rates then.
drawn_graph graph_of(const std::vector<surveyed>& before, const std::vector<surveyed>& now, const std::string& prefix);

/// By host: each component with its sessions, what it uses and gives over them, and what it misses.
styled_page graph_as_page(const drawn_graph& of);
/// For Graphviz: an arrow goes from who uses a service to who provides it.
std::string graph_as_dot(const drawn_graph& of);

} // namespace ise::cli
