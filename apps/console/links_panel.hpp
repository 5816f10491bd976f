#pragma once
#include "actions.hpp"

#include <components/gui_client/view.hpp>

#include <QFrame>
#include <QWidget>

#include <map>
#include <string>

class QLabel;
class QScrollArea;
class QVBoxLayout;

namespace atirma::console {

class link_details;

/// One link to the boat: last heard, signal, costs, and the details of its kind of link.
class link_card : public QFrame {
    Q_OBJECT
public:
    link_card(std::string path, operator_actions& actions, QWidget* parent = nullptr);
    /// Returns whether it has got new controls.
    bool show_link(const link_view& link, const boat_view& boat, utc_time now);
    /// Puts its controls behind `before` in the tab order; returns the last one.
    QWidget* follow_in_tab_order(QWidget* before);

private:
    std::string path_;
    operator_actions& actions_;
    QVBoxLayout* column_;
    QLabel *head_, *state_;
    QLabel *heard_, *signal_, *packets_, *lost_, *queue_, *traffic_, *boat_side_, *commands_, *seal_;
    link_details* details_ = nullptr; ///< after the first report of its proxy
};

/// A communication node: whether it stores packets, and its peer.
class node_card : public QFrame {
    Q_OBJECT
public:
    explicit node_card(const std::string& path, QWidget* parent = nullptr);
    void show_node(const node_view& node, utc_time now);

private:
    QLabel *state_, *words_;
};

class links_panel : public QWidget {
    Q_OBJECT
public:
    explicit links_panel(operator_actions& actions, QWidget* parent = nullptr);
    void show_snapshot(const snapshot& seen, utc_time now);

private:
    operator_actions& actions_;
    QScrollArea* area_;
    QVBoxLayout* column_;
    QLabel* empty_;
    std::map<std::string, link_card*> cards_;
    std::map<std::string, node_card*> nodes_;
};

} // namespace atirma::console
