#pragma once
#include <cstdint>
#include <deque>
#include <map>
#include <utility>
#include <vector>

namespace atirma {

/// Telecommands by id, in bounded memory: those that are open, in the order in which they came, and the last ones that
/// were decided. Pointers and references hold until the entry is forgotten.
template <class Entry>
class telecommand_table {
public:
    explicit telecommand_table(std::size_t max_decided) : max_decided_(max_decided) {}

    Entry* find(std::uint32_t id) {
        auto found = entries_.find(id);
        return found == entries_.end() ? nullptr : &found->second;
    }
    const Entry* find(std::uint32_t id) const { return const_cast<telecommand_table*>(this)->find(id); }
    Entry& at(std::uint32_t id) { return entries_.at(id); }
    const Entry& at(std::uint32_t id) const { return entries_.at(id); }
    const std::vector<std::uint32_t>& open() const noexcept { return open_; }

    /// One whose id is not known yet.
    Entry& add(std::uint32_t id, Entry entry, bool decided = false) {
        auto& kept = entries_.emplace(id, std::move(entry)).first->second;
        if (decided) remember(id);
        else open_.push_back(id);
        return kept;
    }
    /// An open one is decided; the oldest that was is forgotten.
    void decide(std::uint32_t id) {
        std::erase(open_, id);
        remember(id);
    }
    void forget(std::uint32_t id) {
        std::erase(open_, id);
        std::erase(decided_, id);
        entries_.erase(id);
    }

private:
    void remember(std::uint32_t id) {
        decided_.push_back(id);
        if (decided_.size() <= max_decided_ || decided_.size() == 1) return;
        entries_.erase(decided_.front());
        decided_.pop_front();
    }

    std::size_t max_decided_;
    std::map<std::uint32_t, Entry> entries_;
    std::vector<std::uint32_t> open_;   // as they came
    std::deque<std::uint32_t> decided_; // as they were decided
};

} // namespace atirma
