#pragma once
#include <components/boat/communication.hpp>
#include <components/communication_node/node_context.hpp>

#include <memory>

namespace atirma {

/// The boat over all links together: keeps every packet of all proxies once, tells them on, takes the telecommands of
/// all operators, and knows who has the authority. Two of them back each other. Services: those of a proxy
/// (components/boat/services.hpp), `telemetry_store`, and components/boat/communication.hpp.
///
/// A store that cannot be opened is tried again, and the log says why; that of a newer program ends `run()` with an
/// error. A damaged store is set aside (renamed, never deleted), and a new one is filled from what is sound in it and
/// from the other node; the log and `communication_state` report it. While the disk takes nothing packets wait in
/// memory, nothing is acknowledged, and the other node serves the role.
class communication_node final : public ise::component {
public:
    explicit communication_node(communication_node_options options = communication_node_options());
    ~communication_node() override;

    /// On the component's loop; nothing before its store is open.
    communication_state how() const;

private:
    struct parts;

    ise::task<> run() override;

    communication_node_options options_;
    node_context here_;
    std::unique_ptr<parts> parts_; ///< as soon as its store is open
};

} // namespace atirma
