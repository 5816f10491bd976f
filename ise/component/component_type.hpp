#pragma once
#include <ise/component/component.hpp>
#include <ise/component/live_parameters.hpp>
#include <ise/component/parameter.hpp>
#include <ise/component/type_info.hpp>

#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace ise {

/// A type of component that a program can run: its parameters, and a function that makes one from them.
struct component_type {
    /// The description of the type: name, parameters, services.
    type_info about;
    /// Bound to the variables that `make` uses, which it keeps alive.
    parameter_set parameters;
    /// Makes a component from the present values of the parameters; see `makes`.
    std::function<std::unique_ptr<component>()> make;
    /// Notifies a running component of changed parameters; it throws to refuse the change.
    std::function<void(component&)> changed;

    /// `path`: the default path of a component of this type; may be empty.
    component_type(std::string name, std::string description, std::string path = {}) {
        about.name = std::move(name);
        about.description = std::move(description);
        about.path = std::move(path);
    }

    /// Declares a service that components of this type provide, for `ise start --types`, `--help` and the order of a
    /// deployment: providers are started before components that require it. A declaration only: the component itself
    /// calls `provide` or `publish`.
    template <class Contract>
    component_type& provides(const Contract& service) {
        return has(service, true);
    }
    /// Declares a service of others that components of this type use; the `_` because `requires` is a keyword. A
    /// declaration only: the component itself calls `require`, by which `ise doctor` finds that nobody provides it.
    template <class Contract>
    component_type& requires_(const Contract& service) {
        return has(service, false);
    }
    /// Makes components `C(*options)`. A parameter that is declared changeable takes a member
    /// `void C::change(const Options& now)`: called on its loop with the new values in `now`, perhaps before `run()`.
    /// An exception refuses the change, and the values stay as they were.
    template <class C, class Options>
    component_type& makes(std::shared_ptr<Options> options) {
        make = [options] { return std::make_unique<C>(*options); };
        if constexpr (requires(C & one, const Options& now) { one.change(now); })
            changed = [options](component& one) { static_cast<C&>(one).change(*options); };
        return *this;
    }
    /// For component_options, once the parameters are set. Throws errc::invalid_argument if a parameter is changeable,
    /// but no function receives the change.
    std::shared_ptr<live_parameters> live() const;
    /// Declares an environment variable that the program reads: `ise start --env` and deployment files may set only
    /// these.
    component_type& reads(std::string variable) { return about.variables.push_back(std::move(variable)), *this; }

private:
    template <class Contract>
    component_type& has(const Contract& service, bool provided) {
        about.services.push_back(
            {std::string(service.name()), std::string(ise::name_of(Contract::types().kind)), provided});
        return *this;
    }
};

/// Makes the types of a program, each time anew.
using type_maker = std::function<std::vector<component_type>()>;

/// The answer of a program to `--describe`: one line of JSON. `shares`: several of its components may share a process.
std::string describe_types(const std::string& program, const std::string& version,
                           const std::vector<component_type>& types, bool shares = false);

/// Parses "atirma/gateway=5": a role and the priority in it. Fails with errc::invalid_argument.
result<std::pair<std::string, std::int32_t>> parse_role(std::string_view text);

/// Runs a program with one component of its types:
///
///     PROGRAM --describe                     its types as JSON, for instantiation servers
///     PROGRAM run TYPE --help                parameters with defaults, services, options
///     PROGRAM run TYPE [--path=PATH] [--listen=ENDPOINT]... [--advertise=ENDPOINT]... [--name-server=ENDPOINT]
///                      [--role=ROLE=PRIORITY]... [--log-level=LEVEL] [--key=FILE] [--tls=FOLDER]
///                      [--demand-credentials=yes|no] [--poll=MICROSECONDS] [--PARAMETER=VALUE]...
///
/// until SIGINT or SIGTERM. A parameter that is not given is taken from the environment: ISE_PARAMETER_WIND_SPEED for
/// --wind-speed. Returns the exit code: 0 success, 1 the component failed, 2 wrong arguments, with the reason on
/// stderr. For `main`: `return ise::main(count, words, types, "1.0");`
int main(int count, const char* const* words, std::vector<component_type> types, const std::string& version = {});

/// The same for a program whose components may also share a process, each on a thread of its own, at the request of an
/// instantiation server (`ise start --process`). It has one more command line:
///
///     PROGRAM host --control=ENDPOINT... [--name-server=ENDPOINT] [--log-level=LEVEL]
///
/// `types` is called for each component, from any thread: parameters are bound to variables, which two components of a
/// type must not share.
int main(int count, const char* const* words, const type_maker& types, const std::string& version = {});

} // namespace ise
