#include "look.hpp"

#include "survey.hpp"
#include "text.hpp"

#include <nlohmann/json.hpp>

#include <fmt/format.h>

#include <map>

namespace ise::cli {
namespace {

using nlohmann::ordered_json;

struct branch {
    std::string path;
    const surveyed* component = nullptr; ///< of that path, if there is one
    std::map<std::string, branch> below;
};

branch grow(const std::vector<surveyed>& all) {
    branch root;
    for (const auto& one : all) {
        auto* at = &root;
        for (std::size_t from = 0; from < one.name.path.size();) {
            auto to = std::min(one.name.path.find('/', from), one.name.path.size());
            at = &at->below[one.name.path.substr(from, to - from)];
            at->path = one.name.path.substr(0, to);
            from = to + 1;
        }
        at->component = &one;
    }
    return root;
}

std::string about(const surveyed& one) {
    return fmt::format("  {}, {}, process {}, lease renewed {} ago", printable(one.name.state),
                       printable(one.name.host_name), one.name.process_id, show_duration(one.name.lease_age));
}

std::vector<std::string> services_of(const surveyed& one) {
    std::vector<std::string> lines;
    if (!one.about) return {"(does not answer)"};
    for (const auto& service : one.about->services)
        if (!is_own_service(service.name))
            lines.push_back(
                fmt::format("{} {}", service.provided ? (service.kind == 0 ? "answers  " : "publishes") : "needs    ",
                            printable(service.name)));
    return lines;
}

void draw(const branch& of, const std::string& before, bool services, std::string& text) {
    std::vector<std::string> leaves;
    if (services && of.component) leaves = services_of(*of.component);
    for (std::size_t at = 0; at < leaves.size(); ++at)
        text += before + (at + 1 == leaves.size() && of.below.empty() ? "└─ " : "├─ ") + leaves[at] + "\n";
    std::size_t left = of.below.size();
    for (const auto& [name, one] : of.below) {
        bool last = --left == 0;
        bool top = of.path.empty();
        text += fmt::format("{}{}{}{}\n", before,
                            top    ? ""
                            : last ? "└─ "
                                   : "├─ ",
                            printable(name), one.component ? about(*one.component) : "/");
        draw(one, top ? before : before + (last ? "   " : "│  "), services, text);
    }
}

ordered_json as_json(const branch& of, bool services) {
    auto all = ordered_json::array();
    for (const auto& [name, one] : of.below) {
        ordered_json told;
        told["name"] = name;
        told["path"] = one.path;
        if (one.component) {
            const auto& listed = one.component->name;
            told["state"] = listed.state;
            told["host"] = listed.host_name;
            told["process_id"] = listed.process_id;
            told["lease_age_s"] = std::chrono::duration<double>(listed.lease_age).count();
            if (services) {
                auto names = ordered_json::array();
                if (one.component->about)
                    for (const auto& service : one.component->about->services)
                        if (service.provided && !is_own_service(service.name)) names.push_back(service.name);
                told["services"] = one.component->about ? std::move(names) : ordered_json();
            }
        }
        told["below"] = as_json(one, services);
        all.push_back(std::move(told));
    }
    return all;
}

} // namespace

task<> tree(context& in, tree_options options) {
    check_prefix(options.prefix);
    std::vector<surveyed> all;
    if (options.services) {
        survey_options what;
        what.prefix = options.prefix;
        all = co_await survey(in, what);
    } else {
        auto names = co_await listed_names(in, options.prefix);
        for (auto& one : names) {
            all.emplace_back();
            all.back().name = std::move(one);
        }
    }
    auto root = grow(all);
    std::string text;
    if (in.set.json)
        text = as_json(root, options.services).dump(-1, ' ', false, ordered_json::error_handler_t::replace) + "\n";
    else draw(root, "", options.services, text);
    co_await in.out.write(in.self, std::move(text));
    if (all.empty()) note_nothing(in, options.prefix);
}

} // namespace ise::cli
