#pragma once
#include <ise/instantiation/launch_rules.hpp>
#include <ise/instantiation/probe.hpp>
#include <ise/instantiation/services.hpp>

#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace ise::instantiation {

/// What is to be run, checked: words that cannot be taken for other options than they are.
struct launch_plan {
    std::string program;          ///< the file's name in the catalogue
    std::string path;             ///< of the component
    std::vector<endpoint> listen; ///< also those that parameters name
    std::vector<std::string> words;
    std::vector<std::pair<std::string, std::string>> variables;
    std::optional<probe_target> probe;
};

/// The component types that can be started: what the programs of a folder said of themselves.
class catalogue {
public:
    static constexpr std::size_t max_programs = 64;
    static constexpr std::size_t max_types = 512;

    /// Takes in what a program has described. Types of names that make no sense, or that another program has, are left
    /// out; `problems()` says so.
    void add(const std::string& program, const std::string& description);
    void add_problem(std::string what) { problems_.push_back(std::move(what)); }

    types_response tell() const;
    /// Null: there is no such type.
    const type_info* find(const std::string& type) const;
    const std::vector<std::string>& problems() const noexcept { return problems_; }

    /// What a request comes to. errc::no_such_name: no such type; errc::invalid_argument: a path that is none, a
    /// parameter, endpoint, variable or probe that is not allowed. Always with what there is, or what is allowed.
    /// `unique` makes local endpoints of their own.
    result<launch_plan> plan(const start_request& request, const launch_rules& rules, std::uint64_t unique) const;

private:
    std::map<std::string, catalogue_type> types_;
    std::vector<std::string> problems_;
};

} // namespace ise::instantiation
