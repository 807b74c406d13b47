"""What people read: pages, tables, figures."""
