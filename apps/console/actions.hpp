#pragma once
#include <components/gui_client/operator_port.hpp>

#include <QObject>

#include <functional>
#include <optional>

class QWidget;

namespace atirma::console {

/// What the windows do goes through here: dangerous commands are confirmed, and it is said where nothing could be
/// given.
class operator_actions : public QObject {
    Q_OBJECT
public:
    using sink = std::function<bool(action)>;
    operator_actions(sink to, QWidget* window) : to_(std::move(to)), window_(window) {}

    /// Over the link that was chosen for commands. False where the operator changed his mind, or nothing took it.
    bool give(boat_command command);
    bool set_mode(sailing_mode mode);
    bool upload(std::vector<waypoint> points, const std::vector<waypoint>& on_boat);
    bool sail_there(const waypoint& point);
    bool act(action what);
    /// A question that Enter answers with no.
    bool confirmed(const QString& what, const QString& why);
    /// Who has the authority now: commands offer to take it first.
    void know(const authority_view& authority) { authority_ = authority; }

    /// The path of a proxy; empty: the console chooses.
    void choose_link(std::string path) { via_ = std::move(path); }
    const std::string& link() const noexcept { return via_; }

Q_SIGNALS:
    void said(const QString& text);

private:
    /// Asks where this console does not command the boat. Nothing: the operator changed his mind, or asks the holder.
    std::optional<taking> authority_for(const QString& what);

    sink to_;
    QWidget* window_;
    std::string via_;
    authority_view authority_;
};

} // namespace atirma::console
