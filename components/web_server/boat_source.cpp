#include <components/web_server/boat_source.hpp>

#include <ise/core/error.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>

namespace atirma {
namespace {

constexpr std::array<std::string_view, 4> of_the_page{"api", "boats", "embed", "events"};

std::string_view trimmed(std::string_view text) {
    while (!text.empty() && text.front() == ' ') text.remove_prefix(1);
    while (!text.empty() && text.back() == ' ') text.remove_suffix(1);
    return text;
}

[[noreturn]] void refuse(std::string why) {
    throw ise::error(ise::errc::invalid_argument, "web server: " + std::move(why));
}

} // namespace

std::string address_of(std::string_view name) {
    std::string made;
    for (char c : name) {
        if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
        bool plain = (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9');
        if (plain) made += c;
        else if (!made.empty() && made.back() != '-') made += '-';
    }
    while (!made.empty() && made.back() == '-') made.pop_back();
    return made.substr(0, 40);
}

boat_source parse_boat(std::string_view text) {
    auto equals = text.find('=');
    boat_source made;
    if (equals != std::string_view::npos) {
        made.name = trimmed(text.substr(0, equals));
        for (auto rest = text.substr(equals + 1); !rest.empty();) {
            auto end = std::min(rest.find(','), rest.size());
            if (auto path = trimmed(rest.substr(0, end)); !path.empty()) made.telemetry.emplace_back(path);
            rest.remove_prefix(std::min(end + 1, rest.size()));
        }
    }
    if (made.name.empty() || made.telemetry.empty())
        refuse(
            fmt::format("a boat is told as NAME=PATH[,PATH], such as \"Vela=vela/communication\", not \"{}\"", text));
    return made;
}

void name_boats(std::vector<boat_source>& boats) {
    for (auto boat = boats.begin(); boat != boats.end(); ++boat) {
        if (boat->id.empty()) boat->id = address_of(boat->name);
        if (boat->id.empty() || boat->id != address_of(boat->id))
            refuse(fmt::format("the boat \"{}\" has no address: its name needs letters a-z or digits", boat->name));
        if (std::ranges::find(of_the_page, boat->id) != of_the_page.end())
            refuse(fmt::format("no boat can be called \"{}\": /{} is a part of the page", boat->name, boat->id));
        auto same = std::find_if(boats.begin(), boat, [&](const boat_source& other) { return other.id == boat->id; });
        if (same != boat)
            refuse(fmt::format("the boats \"{}\" and \"{}\" have the same address, /{}: name one otherwise", same->name,
                               boat->name, boat->id));
    }
}

} // namespace atirma
