#include <components/gui_client/command_log.hpp>

#include <components/gui_client/words.hpp>

#include <algorithm>

namespace atirma::console {
namespace {
// As weight_of(telecommand_stage): an answer of the boat is final; any other end may still be corrected by it.
int weight_of(command_phase phase) {
    if (phase == command_phase::done || phase == command_phase::refused || phase == command_phase::late) return 2;
    return is_over(phase) ? 1 : 0;
}
bool may_follow(command_phase now, command_phase next) {
    if (next == command_phase::asking) return now == command_phase::asking;
    return weight_of(next) >= weight_of(now);
}
} // namespace

command_phase command_log::phase_of(telecommand_stage stage, const std::optional<ack_code>& result) noexcept {
    switch (stage) {
        case telecommand_stage::pending:
        case telecommand_stage::queued: return command_phase::queued;
        case telecommand_stage::sent: return command_phase::sent;
        case telecommand_stage::acknowledged:
            if (result == ack_code::expired) return command_phase::late;
            return result.value_or(ack_code::done) == ack_code::done ? command_phase::done : command_phase::refused;
        case telecommand_stage::failed: return command_phase::failed;
        case telecommand_stage::expired: return command_phase::expired;
    }
    return command_phase::queued;
}

void command_log::asked(command_entry entry) {
    shared_.reset();
    if (auto* known = seek(entry.id)) { // the proxy reported it first
        known->own = true;
        known->what = std::move(entry.what);
        if (!known->valid_until) known->valid_until = entry.valid_until;
        return;
    }
    add(std::move(entry));
}

const command_entry& command_log::on_status(const std::string& path, const telecommand_status& status, utc_time now) {
    shared_.reset();
    bool from_record = status.asked_at != utc_time(); // a record knows when it was given
    auto* known = seek(status.id);
    if (!known) {
        command_entry entry;
        entry.id = status.id;
        entry.path = path;
        entry.what = describe(status.kind);
        entry.asked_at = from_record ? status.asked_at : now;
        known = &add(std::move(entry));
    }
    if (!status.asked_by.empty()) known->asked_by = status.asked_by;
    if (!status.asked_as.empty()) known->asked_as = status.asked_as;
    if (status.valid_until) known->valid_until = status.valid_until;
    if (status.executed_at) known->executed_at = status.executed_at;
    if (status.command && !known->own) known->what = describe(*status.command);
    auto phase = phase_of(status.state, status.result);
    if (!may_follow(known->phase, phase)) return *known;
    known->path = path;
    known->link = status.link;
    known->phase = phase;
    known->value = status.value;
    known->text = status.text;
    known->attempts = std::max(known->attempts, status.attempts);
    known->changed_at = from_record ? status.at : now;
    return *known;
}

void command_log::on_outcome(std::uint32_t id, command_phase phase, std::optional<float> value, std::string text,
                             utc_time now) {
    auto* known = seek(id);
    if (!known || !may_follow(known->phase, phase)) return;
    shared_.reset();
    known->phase = phase;
    if (value) known->value = value;
    known->text = std::move(text);
    known->changed_at = now;
}

void command_log::on_executed(std::uint32_t id, utc_time at) {
    if (auto* known = seek(id)) {
        shared_.reset();
        known->executed_at = at;
    }
}

void command_log::on_called_back(std::uint32_t id, std::string text) {
    if (auto* known = seek(id)) {
        shared_.reset();
        known->called_back = std::move(text);
    }
}

const command_entry* command_log::find(std::uint32_t id) const { return const_cast<command_log*>(this)->seek(id); }

std::size_t command_log::open(const std::string& path) const {
    return static_cast<std::size_t>(std::count_if(entries_.begin(), entries_.end(),
                                                  [&](const auto& e) { return e.path == path && !is_over(e.phase); }));
}

std::shared_ptr<const std::vector<command_entry>> command_log::entries() {
    if (!shared_) shared_ = std::make_shared<const std::vector<command_entry>>(entries_.begin(), entries_.end());
    return shared_;
}

command_entry* command_log::seek(std::uint32_t id) {
    auto found = std::find_if(entries_.rbegin(), entries_.rend(), [id](const auto& e) { return e.id == id; });
    return found == entries_.rend() ? nullptr : &*found;
}

command_entry& command_log::add(command_entry entry) {
    if (entries_.size() >= most_) {
        auto over = std::find_if(entries_.begin(), entries_.end(), [](const auto& e) { return is_over(e.phase); });
        entries_.erase(over == entries_.end() ? entries_.begin() : over);
    }
    entry.changed_at = entry.asked_at;
    auto place = std::upper_bound(entries_.begin(), entries_.end(), entry.asked_at,
                                  [](utc_time at, const command_entry& one) { return at < one.asked_at; });
    return *entries_.insert(place, std::move(entry));
}

} // namespace atirma::console
