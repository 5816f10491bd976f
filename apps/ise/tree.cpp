// ise tree: the components as a tree.
#include "json.hpp"
#include "options.hpp"
#include "survey.hpp"
#include "target.hpp"
#include "text.hpp"

#include <fmt/format.h>

#include <map>
#include <memory>

namespace ise::cli {
namespace {

struct tree_options {
    std::string prefix;
    bool services = false; ///< under each component
};

struct tree_entry {
    std::string name, path;
    if_any<std::string> state, host; ///< where there is a component
    if_any<std::uint64_t> process_id;
    if_any<duration> lease_age_s;
    if_any<std::optional<std::vector<std::string>>> services; ///< null: it does not answer
    std::vector<tree_entry> below;
};

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

std::string about_component(const surveyed& one) {
    return fmt::format("  {}, {}, process {}, lease renewed {} ago", printable(one.name.state),
                       printable(one.name.host_name), one.name.process_id, show_duration(one.name.lease_age));
}

std::vector<std::string> service_leaves(const surveyed& one) {
    std::vector<std::string> lines;
    if (!one.about) return {"(does not answer)"};
    for (const auto& service : one.about->services)
        if (!is_own_service(service.name))
            lines.push_back(fmt::format("{} {}  ({})", service.provided ? "provides" : "needs   ",
                                        printable(service.name), kind_name(service)));
    return lines;
}

void draw(const branch& of, const std::string& before, bool services, std::string& text) {
    std::vector<std::string> leaves;
    if (services && of.component) leaves = service_leaves(*of.component);
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
                            printable(name), one.component ? about_component(*one.component) : "/");
        draw(one, top ? before : before + (last ? "   " : "│  "), services, text);
    }
}

std::vector<tree_entry> entries_below(const branch& of, bool services) {
    std::vector<tree_entry> all;
    for (const auto& [name, one] : of.below) {
        tree_entry made;
        made.name = name;
        made.path = one.path;
        if (one.component) {
            const auto& listed = one.component->name;
            made.state = listed.state;
            made.host = listed.host_name;
            made.process_id = listed.process_id;
            made.lease_age_s = listed.lease_age;
            if (services) made.services.emplace();
            if (services && one.component->about) {
                auto& names = made.services->emplace();
                for (const auto& service : one.component->about->services)
                    if (service.provided && !is_own_service(service.name)) names.push_back(service.name);
            }
        }
        made.below = entries_below(one, services);
        all.push_back(std::move(made));
    }
    return all;
}

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
    if (in.set.json) text = json_line(entries_below(root, options.services));
    else draw(root, "", options.services, text);
    co_await in.out.write(in.self, std::move(text));
    if (all.empty()) note_nothing(in, options.prefix);
}

void declare_tree(command_line::app& app, parsed_command& made) {
    auto given = std::make_shared<tree_options>();
    add_prefix(app, given->prefix);
    app.add_flag("--services", given->services, "their services too");
    app.callback([&made, given] {
        made.looks = given->services;
        made.work = [given](context& in) { return tree(in, *given); };
    });
}

} // namespace

extern const command tree_command{"tree", see_group, "shows the components as a tree", "  ise tree --services\n",
                                  declare_tree};

} // namespace ise::cli
