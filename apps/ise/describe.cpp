#include "commands.hpp"

#include "description.hpp"
#include "target.hpp"
#include "text.hpp"

#include <algorithm>

namespace ise::cli {

task<> describe(context& in, describe_options options) {
    auto who = co_await reach(in, options.name);
    auto about = co_await ask_about(in, who);
    std::string text;
    if (options.names) {
        for (const auto& one : about.services)
            if (one.provided && (options.all || !is_internal(one.name))) text += printable(one.name) + "\n";
    } else {
        if (!options.all) std::erase_if(about.services, [](const auto& one) { return is_internal(one.name); });
        auto members = co_await members_of(in, options.name);
        if (in.set.json) {
            text = as_json(about, options.name, members);
        } else {
            if (members.role) text = role_page(options.name, members, in.out.width());
            text += as_page(about, options.name, in.out.width());
        }
    }
    co_await in.out.write(in.self, std::move(text));
}

} // namespace ise::cli
