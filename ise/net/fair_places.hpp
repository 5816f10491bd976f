#pragma once
#include <cstddef>
#include <cstdint>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <string>
#include <string_view>

namespace ise::net {

/// The host of a peer ("tcp://10.0.0.2:40112" → "10.0.0.2"), as limits count hosts. An IPv6 address counts by its /64,
/// which every customer of a network gets; an IPv4 address within IPv6 counts as that IPv4 address. Every loopback
/// address (127.0.0.0/8, ::1) is this one host. A peer without an address (local, inproc) is a host of its own name.
std::string host_of(std::string_view peer);

/// The places of a listener, shared fairly among hosts. When all are taken, the host with the most places, a newcomer's
/// own included, loses its oldest place that waits. If none of its places waits, it loses its oldest one only to a host
/// that holds at least two fewer. Otherwise the newcomer is refused.
///
/// Pure: no I/O and no clock. Not thread safe. Outlives its places.
class fair_places {
    struct host;

public:
    /// One taken place; destroying it frees it.
    class place {
    public:
        ~place();
        place(const place&) = delete;
        place& operator=(const place&) = delete;

        /// Its holder has said what it wants and is being served.
        void serve();
        /// Its holder has to say something (again); it is the youngest of those that wait.
        void wait();
        /// Calls `give_up` when the place is lost to a newcomer; the place is free by then. Replaces an earlier one.
        void on_displaced(std::function<void()> give_up) { give_up_ = std::move(give_up); }
        bool displaced() const noexcept { return !host_; }

    private:
        friend class fair_places;
        place(fair_places& of, host& whose);
        void enlist(std::list<place*>& in);
        void leave() noexcept;

        fair_places& of_;
        host* host_;
        std::list<place*>* list_ = nullptr;
        std::list<place*>::iterator entry_;
        std::uint64_t since_ = 0;
        std::function<void()> give_up_;
    };

    explicit fair_places(std::size_t most) : most_(most) {}
    fair_places(const fair_places&) = delete;
    fair_places& operator=(const fair_places&) = delete;

    /// A place that waits, for a connection from `peer`; null where the newcomer is refused.
    std::unique_ptr<place> take(std::string_view peer);
    /// Frees the oldest place that waits of the host with the most places, of those hosts that have one that waits.
    /// False: nobody waits.
    bool make_way();

    std::size_t most() const noexcept { return most_; }
    std::size_t taken() const noexcept { return taken_; }
    std::uint64_t displaced() const noexcept { return displaced_; } ///< places lost to newcomers
    std::uint64_t refused() const noexcept { return refused_; }     ///< newcomers without a place

private:
    struct host {
        std::string name;
        std::list<place*> waiting, served; // oldest first
        std::size_t count() const noexcept { return waiting.size() + served.size(); }
    };
    void displace(place& who);

    std::size_t most_;
    std::size_t taken_ = 0;
    std::uint64_t order_ = 0, displaced_ = 0, refused_ = 0;
    std::map<std::string, host, std::less<>> hosts_;
};

} // namespace ise::net
