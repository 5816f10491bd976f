#include <ise/naming/name_resolver.hpp>

#include <ise/core/sleep.hpp>
#include <ise/naming/name_servers.hpp>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <optional>
#include <utility>

namespace ise {
namespace {

constexpr std::size_t max_remembered = 4096;
constexpr duration session_kept = std::chrono::seconds(10);
// How long a question waits for the server; shorter where the answer of before will do.
constexpr duration patience = std::chrono::seconds(3);
constexpr duration patience_with_memory = std::chrono::milliseconds(700);
// The server was found missing so lately that it is not waited for again.
constexpr duration surely_lost = std::chrono::seconds(1);
constexpr duration brief = std::chrono::milliseconds(50);
constexpr duration max_lookup_pause = std::chrono::milliseconds(500);
constexpr duration question_length = std::chrono::seconds(5);
constexpr duration min_question = std::chrono::milliseconds(50);
constexpr duration way_back = std::chrono::milliseconds(300);

bool leads_there(const endpoint& at, bool same_host, bool same_process) {
    return at.kind->same_process ? same_process : same_host || !within_host(at);
}

// Whether the failure means that nobody could say.
bool server_missing(const failure& why) { return why.code() != errc::no_such_name && why.code() != errc::cancelled; }

// What the server said, without that it was asked.
failure in_own_words(const failure& why) {
    auto text = why.message();
    auto said = text.starts_with("'ise.names.") ? text.find(": ") : std::string::npos;
    return said == std::string::npos ? why : failure(why.code(), text.substr(said + 2), why.executed());
}

result<naming::resolve_response> known_answer(const std::string& path, result<naming::await_response> answer) {
    if (!answer) return answer.error();
    if (answer->found) return std::move(*answer->found);
    if (!answer->certain)
        return failure(errc::name_server_lost,
                       fmt::format("the name server has just started and may not yet know '{}'", path));
    return failure(errc::no_such_name, fmt::format("no component is registered as '{}'", path));
}

} // namespace

std::vector<endpoint> reachable_endpoints(const naming::resolve_response& from, const process_identity& here) {
    bool same_host = from.host_key == here.host_key;
    bool same_process = from.process_key == here.process_key;
    std::vector<endpoint> nearest_first;
    for (const auto& text : from.endpoints) {
        auto at = endpoint::parse(text);
        if (at && leads_there(*at, same_host, same_process)) nearest_first.push_back(std::move(*at));
    }
    // Between equals the order in which they were registered decides.
    std::ranges::stable_sort(nearest_first, {},
                             [](const endpoint& at) { return std::pair(at.kind->rank, !within_host(at)); });
    return nearest_first;
}

name_resolver::name_resolver(service_host& host, std::vector<endpoint> name_servers)
    : host_(host), servers_(std::move(name_servers)), idle_(host.on(), [this] { held_ = remote(); }) {}

name_resolver::~name_resolver() = default;

remote name_resolver::server() {
    if (!held_) {
        auto way = host_.link_to(servers_, std::string(naming::server_path));
        way->hurry(max_lookup_pause, std::chrono::seconds(2));
        held_ = remote(std::move(way));
    }
    idle_.arm(saturating_add(host_.on().now(), session_kept));
    return held_;
}

std::string name_resolver::trouble() const {
    if (!held_ || held_.way().current()) return {};
    auto why = held_.way().obstacle();
    return fmt::format("the name server at {} does not answer{}{}", text_of(servers_), why.empty() ? "" : ": ", why);
}

void name_resolver::note_server(const failure* why, duration waited) {
    if (!why) {
        lost_at_ = time_point::min();
    } else if (server_missing(*why) &&
               waited >= patience_with_memory) { // the way alone may take longer than a brief question
        lost_at_ = host_.on().now();
        if (held_ && why->code() == errc::timed_out) held_.way().try_next(*why);
    }
}

result<resolution> name_resolver::take(const std::string& path, result<naming::resolve_response> answer) {
    if (!answer) {
        if (answer.error().code() == errc::no_such_name) known_.erase(path);
        if (answer.error().code() == errc::no_such_name) return in_own_words(answer.error());
        if (!server_missing(answer.error())) return answer.error();
        if (const auto* last = recall(path)) return *last;
        return failure(errc::name_server_lost,
                       fmt::format("'{}' cannot be resolved: {}", path, answer.error().message()));
    }
    if (!answer->members.empty()) return take_members(path, answer->members, answer->certain);
    resolution found;
    auto& holder = found.members.emplace_back();
    holder.path = path;
    holder.epoch = answer->epoch;
    holder.incarnation = answer->incarnation;
    holder.endpoints = reachable_endpoints(*answer, host_.env().identity());
    if (holder.endpoints.empty())
        return failure(
            errc::unreachable,
            fmt::format(
                "'{}' on {} cannot be reached from {}: it listens on {} only; let it listen on tcp://0.0.0.0:0 too",
                path, answer->host_name, host_.env().identity().host_name,
                answer->endpoints.empty() ? "nothing" : fmt::format("{}", fmt::join(answer->endpoints, ", "))));
    remember(path, found);
    return found;
}

result<resolution> name_resolver::take_members(const std::string& role, const std::vector<naming::role_member>& members,
                                               bool certain) {
    resolution found;
    found.role = true;
    for (const auto& outcome : members) {
        naming::resolve_response one;
        one.host_key = outcome.host_key;
        one.process_key = outcome.process_key;
        one.endpoints = outcome.endpoints;
        location where;
        where.path = outcome.path;
        where.epoch = outcome.epoch;
        where.incarnation = outcome.incarnation;
        where.priority = outcome.priority;
        where.ready = outcome.state == "ready";
        where.endpoints = reachable_endpoints(one, host_.env().identity());
        if (!where.endpoints.empty()) found.members.push_back(std::move(where));
    }
    // A server that has just restarted does not know all yet: those that are known from before stay, by their rank.
    if (const auto* last = recall(role); last && last->role && !certain) {
        for (const auto& before : last->members)
            if (std::ranges::find(found.members, before.path, &location::path) == found.members.end())
                found.members.push_back(before);
        std::ranges::stable_sort(found.members, [](const auto& a, const auto& b) {
            return a.ready != b.ready ? a.ready : a.priority > b.priority;
        });
    }
    if (found.members.empty())
        return failure(
            errc::unreachable,
            fmt::format("none of the {} that serve '{}' can be reached from {}; let them listen on tcp://0.0.0.0:0 too",
                        members.size(), role, host_.env().identity().host_name));
    remember(role, found);
    return found;
}

const resolution* name_resolver::recall(const std::string& path) {
    auto found = known_.find(path);
    if (found == known_.end()) return nullptr;
    found->second.used = ++uses_;
    return &found->second.who;
}

void name_resolver::remember(const std::string& path, const resolution& who) {
    if (known_.size() >= max_remembered && !known_.contains(path))
        known_.erase(std::ranges::min_element(known_, {}, [](const auto& entry) { return entry.second.used; }));
    auto& entry = known_[path];
    entry.who = who;
    entry.used = ++uses_;
}

// --- roles --------------------------------------------------------------------------------------------------------

void name_resolver::follow(const std::string& role, peer_channel& who) {
    auto& entry = followed_[role];
    entry.by.push_back(&who);
    if (!entry.watch)
        entry.watch = std::make_unique<role_watch>(host_, server(), role,
                                                   [this](const naming::role_members& result) { on_news(result); });
}

void name_resolver::unfollow(const std::string& role, peer_channel& who) noexcept {
    auto found = followed_.find(role);
    if (found == followed_.end()) return;
    std::erase(found->second.by, &who);
    if (found->second.by.empty()) followed_.erase(found);
}

void name_resolver::on_news(const naming::role_members& result) {
    if (result.members.empty() && !result.certain) return;
    resolution now;
    now.role = true;
    if (result.members.empty()) {
        known_.erase(result.role);
    } else if (auto taken = take_members(result.role, result.members, result.certain)) {
        now = std::move(*taken);
    }
    auto found = followed_.find(result.role);
    if (found == followed_.end()) return;
    for (auto* one : std::vector(found->second.by)) one->on_members(now);
}

task<result<resolution>> name_resolver::resolve(std::string path) {
    const auto* last = recall(path);
    auto limit = last ? patience_with_memory : patience;
    // Where the server was just missed it is asked all the same: the next one finds out whether it is back.
    if (last && lost_at_ > time_point::min() && host_.on().now() - lost_at_ < surely_lost) limit = brief;
    if (auto role = followed_.find(path); last && role != followed_.end()) {
        if (role->second.watch->current()) co_return *last;
        limit = brief; // its session is away, and so is the server
    }
    naming::resolve_request question;
    question.path = path;
    auto names = server();
    auto answer = co_await names.try_call(naming::resolve, std::move(question), limit);
    note_server(answer ? nullptr : &answer.error(), limit);
    co_return take(path, std::move(answer));
}

task<result<resolution>> name_resolver::resolve_when_present(std::string path, time_point deadline) {
    auto& on = host_.on();
    std::optional<failure> said; // by a server that knew
    for (;;) {
        auto left = std::max(deadline - on.now(), duration{});
        bool last = left <= way_back;
        naming::await_request question;
        question.path = path;
        // The server ends the wait itself, in time for its answer to be here by the deadline.
        if (!last) question.wait = std::min(left - way_back, question_length);
        auto limit = std::max(question.wait + way_back, min_question);
        auto names = server();
        auto answer = co_await names.try_call(naming::wait_for, std::move(question), limit);
        note_server(answer ? nullptr : &answer.error(), limit);
        auto found = take(path, known_answer(path, std::move(answer)));
        if (found || found.error().code() == errc::unreachable || found.error().code() == errc::cancelled)
            co_return found;
        if (found.error().code() == errc::no_such_name) said = found.error();
        if (last) co_return said ? *said : found.error();
        co_await sleep_until(on, std::min(deadline, saturating_add(on.now(), std::chrono::milliseconds(20))));
    }
}

task<std::uint64_t> name_resolver::next_life(std::string path, std::uint64_t than, time_point deadline) {
    auto left = deadline - host_.on().now();
    if (left <= way_back) co_return 0;
    naming::await_request question;
    question.path = std::move(path);
    question.wait = left - way_back;
    question.other_than = than;
    auto names = server();
    auto answer = co_await names.try_call(naming::wait_for, std::move(question), left);
    if (!answer || !answer->found || answer->found->incarnation == than) co_return 0;
    co_return answer->found->incarnation;
}

} // namespace ise
