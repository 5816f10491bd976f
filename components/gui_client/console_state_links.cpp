#include <components/gui_client/console_state.hpp>

#include <components/gui_client/words.hpp>

#include <fmt/format.h>

#include <algorithm>

// The links to the boat: proxies, communication nodes, and the authority.
namespace atirma::console {
namespace {
constexpr auto lag_of_nodes = std::chrono::seconds(30);
} // namespace

link_view* console_state::link_at(const std::string& path) {
    auto found = links_.find(path);
    if (found != links_.end()) return &found->second;
    if (links_.size() >= options_.max_links) return nullptr;
    link_view made;
    made.path = path;
    made.link = link_of_path(path);
    return &links_.emplace(path, std::move(made)).first->second;
}

void console_state::on_xbee(const std::string& path, const xbee_local& local, utc_time now) {
    auto* link = link_at(path);
    if (!link) return;
    link->xbee = local;
    link->xbee_at = now;
}

void console_state::on_xbee_answer(const std::string& path, std::string text) {
    if (auto* link = link_at(path)) link->xbee_answer = std::move(text);
}

void console_state::on_lost(const std::string& path, std::uint64_t packets) {
    if (auto* link = link_at(path)) link->lost += packets;
}

void console_state::on_link(const std::string& path, bool connected, std::string trouble, utc_time now) {
    auto* link = link_at(path);
    if (!link) return;
    if (link->connected != connected || link->since == utc_time()) link->since = now;
    link->connected = connected;
    link->trouble = std::move(trouble);
}

void console_state::takes_commands(const std::string& path) {
    if (auto* link = link_at(path)) link->takes_commands = true;
}

void console_state::on_gprs(const std::string& path, const gprs_state& result, utc_time now) {
    auto* link = link_at(path);
    if (!link) return;
    link->gprs = result;
    link->told_at = now;
}

void console_state::on_account(const std::string& path, const iridium_account& account, utc_time now) {
    auto* link = link_at(path);
    if (!link) return;
    link->account = account;
    link->told_at = now;
}

void console_state::stands_for_all(const std::string& path) {
    auto* link = link_at(path);
    if (!link) return;
    link->all_links = true;
    link->takes_commands = true;
    link->link.reset();
}

void console_state::on_node(const std::string& path, bool connected, std::string trouble,
                            const communication_state* result, utc_time now) {
    auto known = nodes_.find(path);
    if (known == nodes_.end()) {
        if (nodes_.size() >= options_.max_links) return;
        known = nodes_.emplace(path, node_view()).first;
        known->second.path = path;
        known->second.told_at = now; // its alarm is due from now on
    }
    auto& node = known->second;
    node.connected = connected;
    node.trouble = std::move(trouble);
    if (!result) return;
    node.state = *result;
    node.told_at = now;
}

void console_state::on_authority(const authority_state& result, utc_time now) {
    if (authority_.known && result.epoch < authority_.state.epoch) {
        lower_ = lower_authority{result, lower_ ? lower_->since : now};
        return;
    }
    take_authority(result, now);
}

/// After a fail-over the other node may not know the newest change yet. If nothing higher comes for a while, the nodes
/// have begun anew.
void console_state::watch_authority(utc_time now) {
    if (!lower_ || now - lower_->since < lag_of_nodes) return;
    auto result = lower_->state;
    take_authority(result, now);
}

void console_state::take_authority(const authority_state& result, utc_time now) {
    lower_.reset();
    bool was_mine = authority_.mine();
    authority_.known = true;
    authority_.state = result;
    if (was_mine && !authority_.mine() && !authority_.changing)
        alarms_.tell("authority:lost", severity::warning,
                     fmt::format("This console has lost the authority over the boat: {}", result.how), now);
    watch_requests(now);
}

void console_state::watch_requests(utc_time now) {
    const auto& asked_by = authority_.state.asked_by;
    auto first = std::find_if(asked_by.begin(), asked_by.end(), [this](const auto& who) { return !has_gone(who); });
    bool waiting = authority_.mine() && first != asked_by.end();
    alarms_.set(
        "authority:asked", waiting, severity::notice,
        waiting ? fmt::format("{} requests the authority over the boat", operator_label(*first)) : std::string(), now);
}

/// Whether that is another console that the name server does not know any more. Operators without a console, as
/// `ise --as`, have a request without being there.
bool console_state::has_gone(const std::string& console) const {
    auto folder = [](const std::string& path) { return path.substr(0, path.rfind('/') + 1); };
    if (!finding_.uses_names || !finding_.reached || folder(console) != folder(authority_.self)) return false;
    auto here = [&](const present_component& one) { return one.path == console; };
    bool knows_self = std::any_of(present_->begin(), present_->end(), [](const auto& one) { return one.self; });
    return knows_self && std::none_of(present_->begin(), present_->end(), here);
}

void console_state::asks_authority(bool under_way, std::string problem) {
    authority_.changing = under_way;
    authority_.problem = std::move(problem);
}

} // namespace atirma::console
