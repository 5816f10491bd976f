#pragma once
#include <ise/naming/services.hpp>
#include <ise/service/remote.hpp>
#include <ise/service/service_host.hpp>

#include <functional>
#include <memory>
#include <string>

namespace ise {

/// Hears from the name server who serves a role, as long as the object lives. Its coroutine belongs to the host's
/// scope.
class role_watch {
public:
    /// `on_news` is called on the host's loop for everything that is told, never from within the constructor.
    role_watch(service_host& host, remote server, std::string role,
               std::function<void(const naming::role_members&)> on_news);
    ~role_watch();
    role_watch(const role_watch&) = delete;
    role_watch& operator=(const role_watch&) = delete;

    /// Whether what was told last is what the server knows now.
    bool current() const noexcept;

private:
    struct state;
    static task<> run(std::shared_ptr<state> self);

    std::shared_ptr<state> state_;
};

} // namespace ise
