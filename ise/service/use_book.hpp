#pragma once
#include <ise/core/loop.hpp>
#include <ise/core/time.hpp>
#include <ise/session/contract.hpp>

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace ise {

class service_runtime;
class use_book;

/// What a use waits for.
enum class wait_stage : std::uint8_t {
    name,      ///< nobody is known under it
    provider,  ///< somebody is, and no session is made with it
    unreached, ///< nothing waits now: the last call ended without having reached anybody
};

/// "name", "provider", "unreached".
std::string_view name_of(wait_stage stage) noexcept;

/// Something that a component waits for.
struct awaited_use {
    std::string target;                  ///< the path, role or address
    std::string service;                 ///< empty: only the target
    wait_stage stage = wait_stage::name; ///< how far it has come
    time_point since{};                  ///< nobody was reached from then on
    std::string cause;                   ///< the last obstacle
};

/// A way to a provider, as far as it concerns what is waited for.
class use_target {
public:
    /// The path, role or address.
    virtual const std::string& name() const noexcept = 0;
    /// Whether something waits for a session for this service, or, where that is empty, for the provider itself.
    virtual bool awaits(std::string_view service) const noexcept = 0;
    /// Whether it was known at the last try where the provider is.
    virtual bool located() const noexcept = 0;
    /// Why there is no session; empty: nothing is known against it.
    virtual std::string obstacle() const = 0;

protected:
    use_target() = default;
    use_target(const use_target&) = delete;
    use_target& operator=(const use_target&) = delete;
    ~use_target();

    /// Whether its component's services are gone: a handle may be kept for longer.
    bool outlived() const noexcept { return in_ == nullptr; }

private:
    friend class use_book;
    use_book* in_ = nullptr;
};

/// The services of others that a component uses, and what it waits for. Written where a session is missing or new,
/// never with every call. ISE's own services are left out. Bounded (`limit::used_services`): the entry that was touched
/// longest ago goes.
class use_book {
public:
    /// Lifetime: `runtime` outlives it.
    explicit use_book(service_runtime& runtime);
    ~use_book();
    use_book(const use_book&) = delete;
    use_book& operator=(const use_book&) = delete;

    /// Through which services are used, from now on until it goes.
    void add(use_target& way);

    /// There is no session for it, and something begins to wait for one. An empty service: for the target itself.
    void waits(const use_target& way, std::string_view service, const packet_types* types);
    /// There is a session over which it goes.
    void reached(const use_target& way, std::string_view service, const packet_types* types);
    /// It has ended without a session.
    void missed(const use_target& way, std::string_view service, const packet_types* types, std::string cause);

    struct used_service {
        std::string name;
        const packet_types* types = nullptr;
    };
    /// Each service once, by name.
    std::vector<used_service> services() const;
    /// What is waited for now, in order.
    std::vector<awaited_use> awaited() const;
    /// The first that is waited for for longer than `patience`, for people; empty: none.
    std::string summary() const;

    /// `summary()` has changed.
    std::function<void()> on_change;
    void stop() noexcept;

    /// What is waited for longer is logged, and shown in lists.
    static constexpr duration patience = std::chrono::seconds(3);
    /// A call that reached nobody is told for so long.
    static constexpr duration memory = std::chrono::seconds(60);

private:
    struct entry {
        const packet_types* types = nullptr;
        std::uint64_t touched = 0;
        bool missing = false;  // no session since `since`
        bool failed = false;   // the last that wanted one ended without
        bool reported = false; // that it waits
        time_point since{};
        time_point failed_at{};
        std::string cause;
    };
    using key = std::pair<std::string, std::string>; // target, service
    using ways_by_name = std::multimap<std::string_view, const use_target*>;

    entry* touch(const use_target& way, std::string_view service, const packet_types* types);
    /// Whether it is still waited for: how.
    bool look_at(const key& of, const entry& what, const ways_by_name& ways, awaited_use& found) const;
    ways_by_name ways() const;
    void look();
    void watch();

    friend class use_target;

    service_runtime& runtime_;
    timer due_;
    std::vector<use_target*> ways_;
    std::map<key, entry> all_;
    std::uint64_t touches_ = 0;
    bool stopped_ = false;
};

} // namespace ise
