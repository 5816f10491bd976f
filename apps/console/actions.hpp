#pragma once
#include <components/gui_client/operator_port.hpp>

#include <QElapsedTimer>
#include <QObject>

#include <functional>
#include <memory>
#include <optional>

class QWidget;

namespace atirma::console {

/// All actions of the windows pass here: dangerous commands are confirmed, and a failure to pass one on is shown.
class operator_actions : public QObject {
    Q_OBJECT
public:
    using sink = std::function<bool(action)>;
    operator_actions(sink to, QWidget* window) : to_(std::move(to)), window_(window) {}

    /// Sends it over the link that was chosen for commands. Returns false if the operator cancelled, or the component
    /// does not accept it.
    /// `valid_s`: its validity; nothing: the one that was chosen for all, else by kind and link.
    /// An equal one within a double click is dropped: two tacks are none.
    bool give(boat_command command, std::optional<float> valid_s = std::nullopt);
    bool set_mode(sailing_mode mode);
    /// `held`: the operator has confirmed it by holding the button.
    bool upload(std::vector<waypoint> points, const std::vector<waypoint>& on_boat, bool held = false);
    bool sail_there(const waypoint& point);
    bool act(action what);
    /// Asks for a confirmation; Enter cancels.
    bool confirmed(const QString& what, const QString& why);
    /// The state now: without the authority, commands offer to take it first; legs are checked against coast and fence.
    /// `ended`: the component has ended, and takes no actions any more.
    void know(std::shared_ptr<const snapshot> seen, bool ended = false) {
        seen_ = std::move(seen);
        ended_ = ended;
    }
    /// Asks for an override if there is `trouble` with legs (leg_check.hpp). Returns false if the operator cancelled.
    bool overridden(const QString& what, const std::string& trouble);

    /// The shown boat is another one: nothing of the one before goes to it.
    void begin_boat() {
        via_.clear();
        given_.reset();
    }
    /// The path of a proxy; empty: the console chooses.
    void choose_link(std::string path) { via_ = std::move(path); }
    const std::string& link() const noexcept { return via_; }
    /// For all telecommands from now on; nothing: by kind and link.
    void choose_validity(std::optional<float> valid_s) { valid_s_ = valid_s; }
    /// "valid for 60 s".
    QString validity_text(command_kind kind, std::optional<float> valid_s) const;

Q_SIGNALS:
    void said(const QString& text);

private:
    /// Says that nothing can be sent any more, before a question that would be in vain.
    bool has_ended();
    /// Asks the operator if this console does not have the authority. Empty: the operator cancelled, or requests it.
    std::optional<taking> authority_for(const QString& what);

    sink to_;
    QWidget* window_;
    template <class What>
    std::string trouble_of(const What& what) const;

    std::string via_;
    std::shared_ptr<const snapshot> seen_;
    bool ended_ = false;
    std::optional<boat_command> given_; ///< the last one
    QElapsedTimer since_given_;
    std::optional<float> valid_s_;
};

} // namespace atirma::console
