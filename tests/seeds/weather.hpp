#pragma once
#include <ise/core/time.hpp>

#include <map>
#include <string>
#include <utility>

namespace seeds {

/// Where faults were, and until when: what excuses a call that failed.
class weather {
public:
    /// After a fault is over, whoever met it needs this long to be as before: the longest pause of the back-off, the
    /// connect and handshake deadlines, a lease.
    static constexpr ise::duration settling = std::chrono::seconds(16);

    /// Faults of one place may overlap; it is over when the last one is.
    void begin(const std::string& host) { ++hosts_[host].going_on; }
    void end(const std::string& host, ise::time_point at) { hosts_[host].end(at); }
    void begin(const std::string& a, const std::string& b) { ++pairs_[key(a, b)].going_on; }
    void end(const std::string& a, const std::string& b, ise::time_point at) { pairs_[key(a, b)].end(at); }
    void begin_everywhere() { ++everywhere_.going_on; }
    void end_everywhere(ise::time_point at) { everywhere_.end(at); }

    /// Whether nothing has disturbed these two since `from`, or shortly before.
    bool calm(const std::string& a, const std::string& b, ise::time_point from) const {
        return everywhere_.calm(from) && calm_in(hosts_, a, from) && calm_in(hosts_, b, from) &&
               calm_in(pairs_, key(a, b), from);
    }

private:
    struct storm {
        int going_on = 0;
        ise::time_point ended{};
        void end(ise::time_point at) {
            --going_on;
            ended = at;
        }
        bool calm(ise::time_point from) const {
            return going_on == 0 && (ended == ise::time_point{} || ended + settling <= from);
        }
    };
    using pair = std::pair<std::string, std::string>;
    static pair key(const std::string& a, const std::string& b) { return a <= b ? pair(a, b) : pair(b, a); }
    template <class Map, class Key>
    static bool calm_in(const Map& in, const Key& what, ise::time_point from) {
        auto found = in.find(what);
        return found == in.end() || found->second.calm(from);
    }

    std::map<std::string, storm> hosts_;
    std::map<pair, storm> pairs_;
    storm everywhere_;
};

} // namespace seeds
