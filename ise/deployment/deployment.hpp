#pragma once
#include <ise/deployment/value.hpp>
#include <ise/instantiation/services.hpp>

#include <optional>
#include <string>
#include <vector>

namespace ise::deployment {

/// A word of the file, and where it stands.
struct word {
    std::string text;
    place at;
};

/// A host that components run on.
struct wanted_host {
    word name;          ///< in the file
    std::string server; ///< the name of its instantiation server: "boat" is ise/host/boat
};

/// A parameter as the file gives it.
struct wanted_parameter {
    word name;
    std::vector<value> values; ///< one, or of a parameter that may be given several times any number
};

struct wanted_component {
    word name; ///< in the file
    word type, host;
    std::vector<wanted_parameter> parameters;
    std::optional<std::vector<word>> after; ///< by name; nothing: the services that it requires give the order
    /// To start it with. Its arguments follow from the parameters: `complete` (checking.hpp).
    instantiation::start_request request;
};

/// A system as a file describes it.
struct deployment {
    word name;
    std::vector<wanted_host> hosts;
    std::vector<wanted_component> components; ///< in the order of the file

    const wanted_host* host(const std::string& name) const;
    std::optional<std::size_t> component(const std::string& name) const;
};

} // namespace ise::deployment
