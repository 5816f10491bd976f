#pragma once
#include <components/foxglove_gateway/viewer_sessions.hpp>

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace ise::foxglove {

/// The channels, or the services, that viewers know of: all by their numbers, the changes since viewers were told last,
/// and the message for a new viewer. `Entry` is a pointer to what has an `info` with an `id`.
template <class Entry, class Info>
class advertisements {
public:
    using write_added = std::string (*)(const std::vector<const Info*>&);         ///< the message that adds them
    using write_removed = std::string (*)(const std::vector<std::uint32_t>& ids); ///< the message that takes them back
    advertisements(write_added added, write_removed removed) : write_added_(added), write_removed_(removed) {}

    /// Its number must be free; viewers are told by `announce`.
    void add(Entry one) {
        const auto id = one->info.id;
        added_.push_back(id);
        all_.emplace(id, std::move(one));
        list_.reset();
    }
    /// The number is free then; viewers are told by `announce`.
    void remove(std::uint32_t id) {
        if (all_.erase(id) == 0) return;
        if (std::erase(added_, id) == 0) removed_.push_back(id);
        list_.reset();
    }
    Entry find(std::uint32_t id) const { ///< null: there is none
        auto found = all_.find(id);
        return found == all_.end() ? Entry() : found->second;
    }
    std::size_t size() const noexcept { return all_.size(); }

    /// Tells viewers what was removed and added since the last time.
    void announce(viewer_sessions& to) {
        if (!removed_.empty()) to.tell_all(write_removed_(std::exchange(removed_, {})));
        if (added_.empty()) return;
        std::vector<const Info*> infos;
        for (auto id : std::exchange(added_, {})) infos.push_back(&all_.at(id)->info);
        to.tell_all(write_added_(infos));
    }
    std::shared_ptr<const std::string> list() { ///< the message with all of them
        if (!list_) {
            std::vector<const Info*> infos;
            for (const auto& [id, one] : all_) infos.push_back(&one->info);
            list_ = std::make_shared<const std::string>(write_added_(infos));
        }
        return list_;
    }

private:
    write_added write_added_;
    write_removed write_removed_;
    std::map<std::uint32_t, Entry> all_;
    std::vector<std::uint32_t> added_, removed_;
    std::shared_ptr<const std::string> list_; // null: to be made
};

} // namespace ise::foxglove
