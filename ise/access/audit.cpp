#include <ise/access/audit.hpp>

#include <ise/core/real/line_file.hpp>
#include <ise/core/time_text.hpp>

#include <fmt/format.h>

#include <chrono>
#include <map>
#include <utility>

namespace ise::access {
namespace {

// What peers wrote goes into it: nothing of it ends a line or a text.
void put_text(std::string& to, std::string_view name, std::string_view text) {
    to += fmt::format("\"{}\":\"", name);
    for (char one : text) {
        auto letter = static_cast<unsigned char>(one);
        if (letter == '"' || letter == '\\') {
            to += '\\';
            to += one;
        } else if (letter < 0x20 || letter >= 0x7f) {
            to += fmt::format("\\u{:04x}", letter);
        } else {
            to += one;
        }
    }
    to += "\",";
}

} // namespace

std::string json_of(const audit_entry& entry, std::uint64_t left_out) {
    std::string made = "{";
    put_text(made, "at", iso_8601(entry.at, 3));
    put_text(made, "who", entry.who);
    put_text(made, "serial", entry.serial);
    put_text(made, "from", entry.from);
    put_text(made, "component", entry.component);
    put_text(made, "what", entry.what);
    put_text(made, "verdict", entry.allowed ? "allowed" : "denied");
    put_text(made, "rule", entry.rule);
    made += fmt::format("\"left_out\":{}}}", left_out);
    return made;
}

struct audit_log::state {
    struct account {
        unsigned refusals = 0;
        std::uint64_t left_out = 0;
        audit_entry last; // of those left out
    };

    ~state() { tell_left_out(); }
    void tell_left_out() {
        for (const auto& [who, one] : accounts)
            if (one.left_out > 0) to(json_of(one.last, one.left_out - 1));
        accounts.clear();
    }
    account& account_of(const std::string& who) {
        auto found = accounts.find(who);
        if (found != accounts.end()) return found->second;
        return accounts[accounts.size() < most_identities ? who : std::string()];
    }

    std::mutex mutex;
    sink to;
    std::chrono::time_point<std::chrono::system_clock, std::chrono::seconds> second{}; // of the refusals counted
    std::map<std::string, account> accounts;                                           // by identity
};

audit_log::audit_log(sink to) : state_(std::make_shared<state>()) { state_->to = std::move(to); }

result<audit_log> audit_log::open(const std::string& file, std::function<void(const std::string&)> complain) {
    auto opened = line_file::open(file);
    if (!opened) return opened.error();
    auto outcome = std::make_shared<bool>(false);
    return audit_log([to = std::move(*opened), complain = std::move(complain), outcome](const std::string& line) {
        auto written = to->append(line);
        bool failed = !written;
        if (failed && !*outcome) complain(fmt::format("the audit log: {}", written.error().message()));
        *outcome = failed;
    });
}

void audit_log::keep(const audit_entry& entry) const {
    if (!state_) return;
    std::lock_guard lock(state_->mutex);
    auto second = std::chrono::floor<std::chrono::seconds>(
        std::chrono::time_point_cast<std::chrono::system_clock::duration>(entry.at));
    if (second != state_->second) {
        state_->second = second;
        state_->tell_left_out();
    }
    auto& whose = state_->account_of(entry.who);
    if (!entry.allowed && ++whose.refusals > most_refusals) {
        ++whose.left_out;
        whose.last = entry;
        return;
    }
    state_->to(json_of(entry, std::exchange(whose.left_out, 0)));
}

} // namespace ise::access
