#include <ise/name_server/etcd_store.hpp>

#include <ise/core/listed_waiter.hpp>
#include <ise/net/connect.hpp>
#include <ise/packet/detail/text_forms.hpp>

#include <asio/buffer.hpp>
#include <asio/error.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <charconv>

namespace ise {
namespace {

using nlohmann::json;

constexpr std::size_t max_idle_lines = 16;
constexpr std::size_t max_head_bytes = 16 * 1024;

std::string coded(std::string_view text) { return detail::to_base64(as_bytes(text)); }

std::string plain(const json& from, const char* field) {
    auto found = from.find(field);
    if (found == from.end() || !found->is_string()) return {};
    auto raw = detail::from_base64(found->get_ref<const std::string&>());
    return raw ? std::string(reinterpret_cast<const char*>(raw->data()), raw->size()) : std::string();
}

// The gateway writes 64-bit numbers as texts, and leaves out those that are 0.
std::uint64_t number(const json& from, const char* field) {
    auto found = from.find(field);
    if (found == from.end()) return 0;
    if (found->is_number_unsigned()) return found->get<std::uint64_t>();
    if (!found->is_string()) return 0;
    const auto& text = found->get_ref<const std::string&>();
    std::uint64_t value = 0;
    std::from_chars(text.data(), text.data() + text.size(), value);
    return value;
}

std::uint64_t revision_of(const json& answer) {
    auto head = answer.find("header");
    return head == answer.end() ? 0 : number(*head, "revision");
}

const json& list_of(const json& from, const char* field) {
    static const json none = json::array();
    auto found = from.find(field);
    return found == from.end() || !found->is_array() ? none : *found;
}

failure unreadable() { return failure(errc::malformed, "etcd sent an answer that cannot be read"); }

// Of an answer that is not the gateway's.
std::string first_line(std::string_view text) {
    text = text.substr(0, std::min(text.find('\n'), std::size_t{200}));
    std::string printable(text);
    std::ranges::replace_if(
        printable, [](unsigned char letter) { return letter < 0x20 || letter >= 0x7f; }, '?');
    return printable;
}

// The message of an error. In the answer of a stream, such as the renewal of a lease, the error is an object.
std::string words_of(const std::string& answer) {
    auto parsed = json::parse(answer, nullptr, false);
    auto found = parsed.is_object() ? parsed.find("error") : parsed.end();
    if (!parsed.is_object() || found == parsed.end()) return first_line(answer);
    const auto& words = found->is_object() && found->contains("message") ? (*found)["message"] : *found;
    return words.is_string() ? words.get<std::string>() : first_line(answer);
}

bool same_word(std::string_view a, std::string_view b) {
    return std::ranges::equal(a, b, [](unsigned char x, unsigned char y) { return (x | 0x20) == (y | 0x20); });
}

} // namespace

result<std::vector<endpoint>> parse_etcd_members(std::string_view text) {
    constexpr std::string_view clear = "etcd://", secured = "etcds://";
    auto wrong = [&](std::string_view why) {
        return failure(errc::invalid_argument,
                       fmt::format("'{}' {}; a store is written like etcd://a:2379,b:2379,c:2379, over TLS etcds://…",
                                   text.substr(0, 200), why));
    };
    const bool over_tls = text.starts_with(secured);
    if (!over_tls && !text.starts_with(clear)) return wrong("is no store that is known");
    std::vector<endpoint> all;
    text.remove_prefix(over_tls ? secured.size() : clear.size());
    for (std::size_t begin = 0; begin <= text.size();) {
        auto end = std::min(text.find(',', begin), text.size());
        auto one = endpoint::parse(fmt::format("{}://{}", over_tls ? "tls" : "tcp", text.substr(begin, end - begin)));
        if (!one || one->port == 0) return wrong("has a member that is no host:port");
        all.push_back(std::move(*one));
        begin = end + 1;
    }
    return all;
}

// --- HTTP/1.1, as far as the gateway needs it -------------------------------------------------------------------

/// One connection. After a failure it is of no more use.
class etcd_store::line {
public:
    line(loop& on, std::unique_ptr<stream> over)
        : over_(std::move(over)), alarm_(on, [this] {
              late_ = true;
              over_->close();
          }) {}

    void until(time_point deadline) {
        if (deadline == time_point::max()) alarm_.disarm();
        else alarm_.arm(deadline);
    }
    void close() { over_->close(); }

    task<result<void>> send(std::string text) {
        for (std::size_t sent = 0; sent < text.size();) {
            const asio::const_buffer rest[] = {asio::buffer(text.data() + sent, text.size() - sent)};
            auto moved = over_->try_write(rest);
            sent += moved.bytes;
            if (moved.problem == asio::error::would_block) {
                auto problem = co_await over_->wait_writable();
                if (problem || late_) co_return lost(problem);
            } else if (moved.problem) {
                co_return lost(moved.problem);
            }
        }
        co_return result<void>();
    }

    /// The status, and how its body comes.
    task<result<int>> head() {
        auto first = co_await text_line();
        if (!first) co_return first.error();
        int status = first->starts_with("HTTP/1.") && first->size() >= 12 ? std::atoi(first->c_str() + 9) : 0;
        if (status == 0) co_return unreadable();
        length_ = 0;
        chunked_ = false;
        keeps_ = true;
        for (std::size_t count = 0; count != 100; ++count) {
            auto one = co_await text_line();
            if (!one) co_return one.error();
            if (one->empty()) co_return status;
            auto colon = std::min(one->find(':'), one->size());
            std::string_view name = std::string_view(*one).substr(0, colon), value;
            if (colon < one->size()) value = std::string_view(*one).substr(colon + 1);
            while (value.starts_with(' ')) value.remove_prefix(1);
            if (same_word(name, "content-length")) std::from_chars(value.data(), value.data() + value.size(), length_);
            if (same_word(name, "transfer-encoding")) chunked_ = same_word(value, "chunked");
            if (same_word(name, "connection") && same_word(value, "close")) keeps_ = false;
        }
        co_return unreadable();
    }

    /// The next part of the body; an empty one ends it.
    task<result<std::string>> part() {
        std::size_t size = std::exchange(length_, 0);
        if (chunked_) {
            auto said = co_await text_line();
            if (!said) co_return said.error();
            auto [end, problem] = std::from_chars(said->data(), said->data() + said->size(), size, 16);
            if (problem != std::errc() || end == said->data()) co_return unreadable();
            if (size == 0)
                for (;;) { // trailers
                    auto one = co_await text_line();
                    if (!one) co_return one.error();
                    if (one->empty()) co_return std::string();
                }
        }
        if (size > max_answer_bytes) co_return failure(errc::too_large, "an answer of etcd beyond max_answer_bytes");
        while (got_.size() < size) {
            auto more = co_await fill();
            if (!more) co_return more.error();
        }
        auto taken = got_.substr(0, size);
        got_.erase(0, size);
        if (chunked_) {
            auto end = co_await text_line();
            if (!end) co_return end.error();
        }
        co_return taken;
    }
    bool reusable() const noexcept { return keeps_ && !late_ && got_.empty(); }

private:
    failure lost(const std::error_code& why) const {
        if (late_) return failure(errc::timed_out, "etcd did not answer in time");
        if (auto no = over_->verdict()) // the client's certificate is refused only now
            return failure(errc::peer_lost, fmt::format("etcd at {}: {}", over_->peer(), no->message()));
        if (why == asio::error::eof && !heard_)
            return failure(errc::peer_lost, fmt::format("etcd at {} closed the connection without an answer: does it "
                                                        "serve TLS, and --store begins with etcd:// (not etcds://)?",
                                                        over_->peer()));
        return failure(errc::peer_lost, fmt::format("the connection to etcd was lost: {}", why.message()));
    }
    task<result<void>> fill() {
        std::array<char, 16 * 1024> room;
        auto read = co_await over_->read_some(asio::buffer(room));
        if (read.bytes == 0) co_return lost(read.problem);
        heard_ = true;
        got_.append(room.data(), read.bytes);
        co_return result<void>();
    }
    task<result<std::string>> text_line() {
        for (;;) {
            if (auto end = got_.find("\r\n"); end != got_.npos) {
                auto taken = got_.substr(0, end);
                got_.erase(0, end + 2);
                co_return taken;
            }
            if (got_.size() > max_head_bytes) co_return unreadable();
            auto more = co_await fill();
            if (!more) co_return more.error();
        }
    }

    std::unique_ptr<stream> over_;
    bool late_ = false;
    timer alarm_;
    std::string got_;
    std::size_t length_ = 0;
    bool chunked_ = false, keeps_ = true, heard_ = false;
};

etcd_store::etcd_store(loop& on, etcd_options options) : on_(on), options_(std::move(options)) {}
etcd_store::~etcd_store() = default;

void etcd_store::pass_over(route& by, std::size_t member) {
    if (member != by.member) return; // another question has found it out before
    by.member = (by.member + 1) % options_.members.size();
    by.idle.clear(); // the token stays: all members know it
    if (&by == &asking_) end_watch();
}

task<result<std::unique_ptr<etcd_store::line>>> etcd_store::dial(std::size_t member, time_point deadline) {
    auto to = options_.members[member];
    security with;
    with.tls = options_.tls;
    auto made = co_await net::connect_until(on_, to, deadline, std::move(with));
    if (!made) co_return failure(errc::unreachable, fmt::format("etcd: {}", made.error().message()));
    co_return std::make_unique<line>(on_, std::move(*made));
}

std::string etcd_store::request_text(std::string_view target, const std::string& body, std::string_view more) const {
    return fmt::format("POST /v3/{} HTTP/1.1\r\nHost: etcd\r\nContent-Type: application/json\r\n{}{}"
                       "Content-Length: {}\r\n\r\n{}",
                       target, more, token_.empty() ? "" : fmt::format("Authorization: {}\r\n", token_), body.size(),
                       body);
}

task<result<std::string>> etcd_store::post_once(route& by, std::string target, std::string body, duration within) {
    auto deadline = saturating_add(on_.now(), within);
    const auto member = by.member;
    std::unique_ptr<line> over;
    if (!by.idle.empty()) {
        over = std::move(by.idle.back());
        by.idle.pop_back();
    } else {
        auto made = co_await dial(member, deadline);
        if (!made) {
            pass_over(by, member);
            co_return made.error();
        }
        over = std::move(*made);
    }
    over->until(deadline);
    const auto shown = token_;
    auto text = request_text(target, body);
    auto sent = co_await over->send(std::move(text));
    std::optional<failure> why;
    int status = 0;
    if (!sent) why = sent.error();
    if (!why) {
        auto head = co_await over->head();
        if (head) status = *head;
        else why = head.error();
    }
    std::string answer;
    while (!why) {
        auto part = co_await over->part();
        if (!part) why = part.error();
        else if (part->empty()) break;
        else answer += *part;
        if (answer.size() > max_answer_bytes) why = failure(errc::too_large, "an answer beyond max_answer_bytes");
    }
    if (why) {
        pass_over(by, member);
        co_return *why;
    }
    if (over->reusable() && member == by.member && by.idle.size() < max_idle_lines) {
        over->until(time_point::max());
        by.idle.push_back(std::move(over));
    }
    if (status == 200 && &by == &asking_ && keeping_.member != member) { // this one is known to work
        keeping_.member = member;
        keeping_.idle.clear();
    }
    if (status == 200) co_return answer;
    auto words = words_of(answer);
    if (words.find("lease not found") != words.npos) co_return failure(errc::no_such_name, words);
    if (status == 401 || words.find("invalid auth token") != words.npos) {
        if (token_ == shown) token_.clear(); // else there is a newer one already
        co_return failure(errc::unauthorized, fmt::format("etcd refuses the user '{}': {}", options_.user, words));
    }
    if (status >= 500) pass_over(by, member); // no leader, or it stops
    co_return failure(errc::refused, fmt::format("etcd refuses: {} (HTTP status {})", words, status));
}

task<result<void>> etcd_store::log_in(route& by, duration within) {
    const auto until = saturating_add(on_.now(), within);
    while (token_.empty()) {
        if (auto other = logging_in_) {
            listed_waiter end(on_, other->waiting);
            timer late(on_, [&end] { end.resume(); });
            late.arm(until);
            co_await end.wait();
            if (other->outcome) co_return *other->outcome;
            if (on_.now() >= until) co_return failure(errc::timed_out, "etcd did not answer in time");
            continue;
        }
        struct announced { // also where this one is cancelled
            std::shared_ptr<log_in_under_way>& place;
            std::shared_ptr<log_in_under_way> own;
            ~announced() {
                place.reset();
                for (auto* one : own->waiting) one->resume();
            }
        } guard{logging_in_, std::make_shared<log_in_under_way>()};
        logging_in_ = guard.own;
        auto token = co_await new_token(by, until - on_.now());
        if (token) token_ = std::move(*token);
        guard.own->outcome = token ? result<void>() : result<void>(token.error());
        co_return *guard.own->outcome;
    }
    co_return result<void>();
}

task<result<std::string>> etcd_store::new_token(route& by, duration within) {
    json who;
    who["name"] = options_.user;
    who["password"] = options_.password;
    auto outcome = co_await post_once(by, "auth/authenticate", who.dump(), within);
    if (!outcome) co_return outcome.error();
    auto read = json::parse(*outcome, nullptr, false);
    std::string token;
    if (read.is_object()) token = read.value("token", std::string());
    if (token.empty() || token.find_first_of("\r\n") != token.npos)
        co_return failure(errc::unauthorized, "etcd gave no token");
    co_return token;
}

task<result<std::string>> etcd_store::post(route& by, std::string target, std::string body, duration within) {
    if (!options_.user.empty() && token_.empty()) {
        auto in = co_await log_in(by, within);
        if (!in) co_return in.error();
    }
    auto again = target;
    auto what = body;
    auto outcome = co_await post_once(by, std::move(target), std::move(body), within);
    if (outcome || options_.user.empty() || outcome.error().code() != errc::unauthorized) co_return outcome;
    auto in = co_await log_in(by, within); // a token lives five minutes
    if (!in) co_return in.error();
    co_return co_await post_once(by, std::move(again), std::move(what), within);
}

// --- operations -------------------------------------------------------------------------------------------------

namespace {

store_entry entry_of(const json& from, std::size_t prefix) {
    store_entry made;
    made.key = plain(from, "key");
    made.key.erase(0, std::min(prefix, made.key.size()));
    made.value = plain(from, "value");
    made.created = number(from, "create_revision");
    made.changed = number(from, "mod_revision");
    return made;
}

std::string behind(std::string prefix) { // the first key that is not below it
    prefix.back() = static_cast<char>(prefix.back() + 1);
    return prefix;
}

} // namespace

task<result<store_snapshot>> etcd_store::read() {
    store_snapshot all;
    std::string from = options_.prefix;
    for (;;) { // in pages of one revision
        json question;
        question["key"] = coded(from);
        question["range_end"] = coded(behind(options_.prefix));
        question["limit"] = "1000";
        if (all.revision != 0) question["revision"] = std::to_string(all.revision);
        auto outcome = co_await post("kv/range", question.dump());
        if (!outcome) co_return outcome.error();
        auto answer = json::parse(*outcome, nullptr, false);
        if (!answer.is_object()) co_return unreadable();
        if (all.revision == 0) all.revision = revision_of(answer);
        for (const auto& one : list_of(answer, "kvs")) {
            from = plain(one, "key") + '\0';
            all.entries.push_back(entry_of(one, options_.prefix.size()));
        }
        if (!answer.value("more", false)) co_return all;
    }
}

task<result<std::vector<store_outcome>>> etcd_store::write(std::vector<store_step> steps) {
    json request;
    request["success"] = json::array();
    for (const auto& step : steps) {
        auto key = coded(options_.prefix + step.key);
        json one, compare, done, found;
        compare["target"] = "MOD";
        compare["result"] = "EQUAL";
        compare["key"] = key;
        compare["mod_revision"] = std::to_string(step.expected);
        if (step.erase) {
            done["request_delete_range"]["key"] = key;
        } else {
            done["request_put"]["key"] = key;
            done["request_put"]["value"] = coded(step.value);
            done["request_put"]["lease"] = std::to_string(step.lease);
        }
        found["request_range"]["key"] = key;
        one["compare"] = json::array();
        one["compare"].push_back(compare);
        one["success"] = json::array();
        one["success"].push_back(done);
        one["failure"] = json::array();
        one["failure"].push_back(found);
        json nested;
        nested["request_txn"] = one;
        request["success"].push_back(nested);
    }
    auto report = co_await post("kv/txn", request.dump());
    if (!report) co_return report.error();
    auto answer = json::parse(*report, nullptr, false);
    if (!answer.is_object()) co_return unreadable();
    std::vector<store_outcome> outcomes;
    for (const auto& one : list_of(answer, "responses")) {
        store_outcome outcome;
        auto inner = one.find("response_txn");
        if (inner == one.end()) co_return unreadable();
        outcome.done = inner->value("succeeded", false);
        if (outcome.done) outcome.revision = revision_of(answer);
        for (const auto& other : list_of(*inner, "responses"))
            if (auto range = other.find("response_range"); range != other.end())
                for (const auto& held : list_of(*range, "kvs")) outcome.revision = number(held, "mod_revision");
        outcomes.push_back(outcome);
    }
    if (outcomes.size() != steps.size()) co_return unreadable();
    co_return outcomes;
}

// A read that is not answered by a member alone.
task<result<std::uint64_t>> etcd_store::probe() {
    json question;
    question["key"] = coded(options_.prefix);
    question["count_only"] = true;
    auto report = co_await post("kv/range", question.dump());
    if (!report) co_return report.error();
    auto answer = json::parse(*report, nullptr, false);
    if (!answer.is_object() || revision_of(answer) == 0) co_return unreadable();
    co_return revision_of(answer);
}

task<result<void>> etcd_store::grant(std::uint64_t lease, duration length) {
    json question;
    question["ID"] = std::to_string(lease);
    question["TTL"] = std::to_string(std::chrono::ceil<std::chrono::seconds>(length).count());
    auto outcome = co_await post("lease/grant", question.dump());
    if (!outcome) co_return outcome.error();
    co_return result<void>();
}

task<result<void>> etcd_store::keep(std::uint64_t lease, duration within) {
    json question;
    question["ID"] = std::to_string(lease);
    auto outcome = co_await post(keeping_, "lease/keepalive", question.dump(), within);
    if (!outcome) co_return outcome.error();
    auto answer = json::parse(*outcome, nullptr, false);
    auto renewed = answer.is_object() ? answer.find("result") : answer.end();
    if (!answer.is_object() || renewed == answer.end())
        co_return failure(errc::refused, fmt::format("etcd renews no lease: {}", outcome->substr(0, 200)));
    if (number(*renewed, "TTL") == 0) co_return failure(errc::no_such_name, "etcd: the lease is over");
    co_return result<void>();
}

task<result<void>> etcd_store::revoke(std::uint64_t lease) {
    json question;
    question["ID"] = std::to_string(lease);
    auto outcome = co_await post("lease/revoke", question.dump());
    if (!outcome && outcome.error().code() != errc::no_such_name) co_return outcome.error();
    co_return result<void>();
}

task<failure> etcd_store::follow(std::uint64_t revision,
                                 std::function<void(const std::vector<store_change>&, std::uint64_t)> on_changes) {
    if (!options_.user.empty() && token_.empty()) {
        auto in = co_await log_in(asking_, patience);
        if (!in) co_return in.error();
    }
    auto deadline = saturating_add(on_.now(), patience);
    const auto member = asking_.member;
    auto made = co_await dial(member, deadline);
    if (!made) {
        pass_over(asking_, member);
        co_return made.error();
    }
    auto over = std::move(*made);
    struct watched { // so that it ends with the member
        line*& place;
        ~watched() { place = nullptr; }
    } guard{watching_};
    watching_ = over.get();
    over->until(deadline);
    json question;
    question["create_request"]["key"] = coded(options_.prefix);
    question["create_request"]["range_end"] = coded(behind(options_.prefix));
    question["create_request"]["start_revision"] = std::to_string(revision + 1);
    auto text = request_text("watch", question.dump(), "Grpc-Metadata-hasleader: true\r\n");
    auto sent = co_await over->send(std::move(text));
    if (!sent) co_return sent.error();
    auto head = co_await over->head();
    if (!head) co_return head.error();
    over->until(time_point::max());
    std::string got;
    for (;;) {
        auto part = co_await over->part();
        if (!part) co_return part.error();
        if (part->empty()) co_return failure(errc::peer_lost, "etcd has ended the watch");
        got += *part;
        if (got.size() > max_answer_bytes) co_return failure(errc::too_large, "a change beyond max_answer_bytes");
        for (auto end = got.find('\n'); end != got.npos; end = got.find('\n')) {
            auto answer = json::parse(got.substr(0, end), nullptr, false);
            got.erase(0, end + 1);
            auto within = answer.is_object() ? answer.find("result") : answer.end();
            if (!answer.is_object() || within == answer.end())
                co_return failure(errc::peer_lost, "etcd has ended the watch with an error");
            if (number(*within, "compact_revision") != 0)
                co_return failure(errc::superseded, "etcd has compacted the changes since the last one that was seen");
            if (within->value("canceled", false))
                co_return failure(errc::peer_lost, fmt::format("etcd has ended the watch: {}",
                                                               within->value("cancel_reason", std::string())));
            std::vector<store_change> changes;
            for (const auto& one : list_of(*within, "events")) {
                store_change change;
                change.gone = one.value("type", std::string()) == "DELETE";
                if (auto held = one.find("kv"); held != one.end())
                    change.entry = entry_of(*held, options_.prefix.size());
                changes.push_back(std::move(change));
            }
            if (!changes.empty()) on_changes(changes, changes.back().entry.changed);
        }
    }
}

void etcd_store::end_watch() {
    if (watching_) watching_->close();
}

} // namespace ise
